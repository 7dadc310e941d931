"""Choosing the controller's free numbers for one or several scenarios under stated constraints."""
