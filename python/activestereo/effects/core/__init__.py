"""What effects are made of: descriptors, light, view, model, laws, and the operations that several effects share."""
