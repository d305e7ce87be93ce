"""What the depth experiment and benchmark share: pictures, peers, scores, light, figures."""
