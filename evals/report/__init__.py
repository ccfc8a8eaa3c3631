"""A run as one self-contained HTML file: counts, pictures and transcripts."""
