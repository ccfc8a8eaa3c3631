"""A run as one HTML file that needs nothing else: counts, pictures, transcripts."""
