"""For tests and tools: an ideal base, and cancellation at random moments."""
