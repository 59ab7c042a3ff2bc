"""What is said of the causes found: rivals, twins, floor, the answer."""
