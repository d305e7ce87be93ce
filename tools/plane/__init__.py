"""What the plane and floor experiments and the benchmark share: exact images, peers, scores, figures."""
