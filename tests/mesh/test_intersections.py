"""Pairs of faces that intersect: what touches at an edge only does not."""

from vtk_segdeform.mesh import self_intersections


def test_coplanar_faces_beside_an_edge_do_not_intersect_however_they_are_oriented():
    points = [[0, 0, 0], [1, 0, 0], [0.3, 1, 0], [0.4, -1, 0], [0.5, 0.5, 0]]
    for other in ([1, 0, 3], [0, 1, 3]):  # on the other side of the edge 0 1
        assert not len(self_intersections(points, [[0, 1, 2], other]))
    for other in ([1, 0, 4], [0, 1, 4]):  # on the same side
        assert self_intersections(points, [[0, 1, 2], other]).tolist() == [[0, 1]]
