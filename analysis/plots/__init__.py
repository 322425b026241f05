"""Values in, figures out: pictures for papers, readable in black and white."""
