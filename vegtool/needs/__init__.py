"""What the viewers of a scene can ever see of its plants, and so what of them is needed."""
