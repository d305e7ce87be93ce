"""What the depth experiment and benchmark share: images, peers, scores, light, figures."""
