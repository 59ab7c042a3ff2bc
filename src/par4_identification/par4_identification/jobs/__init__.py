"""What a command does once its options are read: from bags or models to results."""
