"""Tests whether robots around a rigid body cage it, and finds places for robots that do."""
