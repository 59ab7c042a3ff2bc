"""What a tool tells its user: words, pictures, pages and files that every report shares."""
