"""Machines with hidden effects, made from physical parts; nothing is shared with the diagnosis."""
