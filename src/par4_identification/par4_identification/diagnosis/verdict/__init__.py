"""How sure the causes are that were found: rivals, twins, noise floor, and the answer."""
