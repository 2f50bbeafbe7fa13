"""What a flight leaves behind: figures, report and files."""
