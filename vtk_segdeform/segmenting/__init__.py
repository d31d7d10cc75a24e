"""How `segmentation` finds limbs: thinning, a coarse copy, necks, fair slices, borders."""
