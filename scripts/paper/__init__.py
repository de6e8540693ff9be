"""The paper of Nanos and Papadopoulos beside freefloat: equations, numbers, findings, the page."""
