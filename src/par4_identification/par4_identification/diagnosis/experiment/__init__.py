"""The motion that would tell apart what the data cannot."""
