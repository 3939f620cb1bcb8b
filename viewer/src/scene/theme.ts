// Few colours: neutral ground, one tone for what touches the world, one for the user's hand, one for contact.

export interface Theme {
  dark: boolean;
  background: number;
  ground: number;
  line: number;
  text: string;
  faint: string;
  sky: number;
  soil: number;
  shadow: number;
}

export const LIGHT: Theme = {
  dark: false,
  background: 0xeef0f2,
  ground: 0xe4e7ea,
  line: 0xb4bcc4,
  text: '#1d2329',
  faint: '#6a747e',
  sky: 0xffffff,
  soil: 0xb9b3aa,
  shadow: 0.26,
};

export const DARK: Theme = {
  dark: true,
  background: 0x15181c,
  ground: 0x1b1f24,
  line: 0x9fb0c0,
  text: '#e6e9ec',
  faint: '#8d98a3',
  sky: 0xdfe8f2,
  soil: 0x3a3630,
  shadow: 0.5,
};

export const COLORS = {
  interface: 0xe08a2c,
  interior: 0x93a1ae,
  free: 0x5c8fbf,
  contact: 0xd0413e,
  pull: 0x2f7fd8,
  cone: 0x3f9b72,
  hinge: 0x1d9a8a,
  slide: 0xc98a1b,
  center: 0xb0449a,
  tendon: 0xb5532f,
};
