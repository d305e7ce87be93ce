"""The match below the pixel, with its uncertainty: error surface, outlines, holes, membrane, motion."""
