"""A machine over its life: base parameters and effects of dated bags, and when they changed."""
