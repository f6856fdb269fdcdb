"""CSV and JSON files that people edit: poses, sheets, compliances."""
