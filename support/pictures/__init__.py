"""Pictures that are drawn for tests and benchmarks, with their truth; most are of ring targets."""
