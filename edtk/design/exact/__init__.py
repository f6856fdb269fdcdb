"""Plans of exactly m experiments: apportionment, exchange, and many starts."""
