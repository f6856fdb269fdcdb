"""Tables that people edit: poses, measurement sheets and compliances."""
