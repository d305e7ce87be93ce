"""The Labmate: what it says on its wire, and its session kept fit for motion."""
