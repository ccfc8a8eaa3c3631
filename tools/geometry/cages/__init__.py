"""Whether robots around a rigid body keep it from escaping, and where such robots stand."""
