"""What instruments read of a robot under load: parameters, models, noise, tasks and tables."""
