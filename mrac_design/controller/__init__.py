"""Force controllers: adaptation laws, the adaptive RST step and the linearising torque."""
