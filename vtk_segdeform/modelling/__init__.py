"""How `models` makes bodies: implicit surfaces, and triangles relaxed on them."""
