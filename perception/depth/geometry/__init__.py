"""Camera, motion, and where a point of given inverse depth goes: thesis (2.1)–(2.5), (2.19)–(2.22)."""
