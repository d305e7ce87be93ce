"""Which depth each pixel has, among planes: sweep, scanline aggregation, forward–backward check."""
