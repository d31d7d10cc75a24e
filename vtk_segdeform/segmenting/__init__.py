"""How `segmentation` finds limbs: a coarse copy, the necks in it, fair slices of the rest."""
