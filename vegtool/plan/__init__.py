"""What a scene's viewers need of its plants, what is left out, and how a budget is spent on it."""
