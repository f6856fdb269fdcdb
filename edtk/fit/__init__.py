"""From measurements to parameters: estimates, covariances and posterior distributions."""
