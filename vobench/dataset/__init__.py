"""Other people's layouts, both ways: folders and bags to sequences, sequences to folders and bags."""
