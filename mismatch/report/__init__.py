"""A diagnosis for its readers: as data, as text, as a page with figures; an index of many."""
