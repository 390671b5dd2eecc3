"""Steps of many rovers as they are asked and answered, by HTTP and over a connection that stays."""
