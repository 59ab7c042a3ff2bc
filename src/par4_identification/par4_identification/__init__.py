"""Recording, identification, validation and diagnosis of measured Par4 data."""
