"""Robots that speak plain JSON over MQTT."""
