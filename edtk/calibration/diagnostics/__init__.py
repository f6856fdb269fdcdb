"""Measurements that look wrong and can be used all the same, by subject."""
