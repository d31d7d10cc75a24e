"""glTF and GLB: reader and writer.

    buffers     JSON and buffers of a file, validated
    scene       the triangles that a scene shows
    contained   a document as one .glb file
    reading     `read_gltf`
    accessors   accessors that get new numbers
    moved       a document that was read, with other positions
    plain       a new document from any surface
    writing     `write_gltf`, `write_gltf_motion`

Why not pygltflib or trimesh: what was read is written again with changes of a few numbers, and
everything else must remain as it is.  pygltflib drops fields that it does not know, and trimesh
makes its own scene of what it knows; neither checks indices against buffers, so that a hostile
file ends in any exception.  `buffers` checks them already, and JSON needs no classes.
"""

from .reading import read_gltf
from .writing import write_gltf, write_gltf_motion

__all__ = ["read_gltf", "write_gltf", "write_gltf_motion"]
