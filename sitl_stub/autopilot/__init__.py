"""PX4's behaviour: commander, flight modes, land detector, failsafes, parameters, control cascade, and the error of its estimate."""
