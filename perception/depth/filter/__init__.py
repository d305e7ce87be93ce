"""What is known of the depth, carried from view to view and fused with what is measured: thesis (2.23)–(2.29)."""
