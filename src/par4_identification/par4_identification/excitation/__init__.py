"""Motions for identification: designed, within limits, and what to expect of them."""
