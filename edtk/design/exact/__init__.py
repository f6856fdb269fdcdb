"""Plans of exactly m experiments: apportionment, exchange, and a search from many starts."""
