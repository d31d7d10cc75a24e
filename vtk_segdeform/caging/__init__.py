"""How `cage_fit` makes a cage: the region as a solid, its columns on a grid, edge collapses."""
