"""Half-edges agree with the definitions, computed face by face, for any triangles."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from campaign import every
from numpy.testing import assert_array_equal

from vtk_segdeform.mesh.grouping import two_sides
from vtk_segdeform.mesh.topology import HalfEdges

pytestmark = pytest.mark.usefixtures("either")


def random_faces(seed: int) -> np.ndarray:
    """Return a few triangles over a few vertices, without a vertex twice in one."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 9))
    return np.array([rng.permutation(n)[:3] for _ in range(rng.integers(1, 12))])


def links(faces, corners):
    """Return the components of *corners* (face, vertex) across edges of exactly two faces."""
    of_edge: dict[frozenset, list[int]] = {}
    for f, face in enumerate(faces.tolist()):
        for a, b in pairwise([*face, face[0]]):
            of_edge.setdefault(frozenset((a, b)), []).append(f)
    group = {corner: {corner} for corner in corners}
    for edge, owners in of_edge.items():
        if len(owners) == 2:
            for vertex in edge:
                one, other = group[owners[0], vertex], group[owners[1], vertex]
                if one is not other:
                    one |= other
                    group.update(dict.fromkeys(other, one))
    return {id(each): each for each in group.values()}.values(), of_edge


@pytest.mark.parametrize("seed", every(4, range(40)))
def test_any_few_triangles_have_the_properties_of_the_definitions(seed):
    for part in range(5):
        faces = random_faces(100 * seed + part)
        n = int(faces.max()) + 1
        half_edges = HalfEdges(faces, n)
        forth = [(a, b) for face in faces.tolist() for a, b in pairwise([*face, face[0]])]
        at = [[h for h, e in enumerate(forth) if {*e} == {*edge}] for edge in forth]
        several = [h for h, around in enumerate(at) if len(around) > 2]
        turned = [h for h, o in enumerate(at) if len(o) == 2 and forth[o[0]] == forth[o[1]]]
        assert sorted(half_edges.boundary.tolist()) == [h for h, o in enumerate(at) if len(o) == 1]
        assert sorted(half_edges.crowded.tolist()) == several
        assert sorted(half_edges.turned.tolist()) == [h for h in turned if h == at[h][0]]
        assert half_edges.all_twins == (all(len(o) == 2 for o in at) and not turned)
        other = [-1 if len(o) == 1 else -2 if len(o) > 2 else sum(o) - h for h, o in enumerate(at)]
        assert half_edges.opposite.tolist() == other
        keys = [frozenset(face) for face in faces.tolist()]
        assert half_edges.repeated.tolist() == [key in keys[:k] for k, key in enumerate(keys)]
        corners = [(f, v) for f, face in enumerate(faces.tolist()) for v in face]
        fans, of_edge = links(faces, corners)
        crowded = {v for edge, owners in of_edge.items() if len(owners) > 2 for v in edge}
        n_fans = Counter(next(iter(fan))[1] for fan in fans)
        pinched = sorted(v for v, k in n_fans.items() if k > 1 and v not in crowded)
        assert half_edges.pinched.tolist() == pinched
        net = Counter()
        for face in faces.tolist():
            for a, b in pairwise([*face, face[0]]):
                net[min(a, b), max(a, b)] += 1 if a < b else -1
        edges = [pair if k > 0 else pair[::-1] for pair, k in net.items() for _ in range(abs(k))]
        assert sorted(edges) == sorted(map(tuple, half_edges.net_boundary.tolist()))
        shell = list(range(len(faces)))
        for owners in of_edge.values():
            shell = [shell[owners[0]] if s in {shell[o] for o in owners} else s for s in shell]
        first = {s: k for k, s in enumerate(dict.fromkeys(shell))}
        assert half_edges.shells.tolist() == [first[s] for s in shell]
        pairs = np.array([o for h, o in enumerate(at) if len(o) == 2 and h == o[0]], int)
        one, other = pairs.reshape(-1, 2).T
        differ = np.isin(one, turned)
        expected = two_sides(len(faces), one // 3, other // 3, differ)
        for found, each in zip(half_edges.sides, expected, strict=True):
            assert_array_equal(found, each)
        flipped = half_edges.flipped(half_edges.sides[1])
        assert half_edges.is_oriented == (not turned)
        assert_array_equal(
            flipped.faces[half_edges.sides[1]], faces[half_edges.sides[1]][:, [0, 2, 1]]
        )


def test_two_faces_back_to_back_are_a_repeated_face():
    half_edges = HalfEdges(np.array([[0, 1, 2], [0, 2, 1]]), 3)
    assert half_edges.repeated.tolist() == [False, True]
    assert half_edges.all_twins
