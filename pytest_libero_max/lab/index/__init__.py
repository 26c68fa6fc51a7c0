"""``libero-max publish index``: published runs side by side on one page."""
