"""What a command does once its options are read: from a robot and models to bags or pages."""
