"""Whose an effect is: the rig's, a material's, each shot's own."""
