"""How `cage_fit` makes a cage: the region as a solid, edge collapses."""
