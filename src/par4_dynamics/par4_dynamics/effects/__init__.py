"""The catalogue of effects: what a machine can do that (20) does not say."""
