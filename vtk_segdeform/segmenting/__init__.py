"""How `segmentation` finds limbs: a coarse copy, necks, fair slices, borders."""
