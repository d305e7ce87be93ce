"""What the flow's experiment and benchmark share: textures moved exactly, walls, peers, scores."""
