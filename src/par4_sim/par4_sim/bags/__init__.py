"""Bags, written."""
