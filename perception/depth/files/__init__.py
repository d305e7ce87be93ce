"""What the program reads and writes: images, motion, camera, reference; maps and clouds."""
