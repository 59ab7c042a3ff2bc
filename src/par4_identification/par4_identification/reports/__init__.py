"""Reports: pages, pictures and templates."""
