"""What is different now from what a model, or older data, said of a machine."""
