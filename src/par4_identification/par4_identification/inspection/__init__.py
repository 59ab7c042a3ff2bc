"""What a bag holds, and what each tool could do with it."""
