"""What the offline tools found, without its looks: sentences, tables, JSON, files."""
