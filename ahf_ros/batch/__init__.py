"""Many images or bags: tasks, their outcomes, and the engines that process them."""
