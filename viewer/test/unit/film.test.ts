import { describe, expect, it } from 'vitest';
import { readFilm } from '../../src/replay/film';

describe('readFilm', () => {
  it('reads a size', () => {
    expect(readFilm('#film=640x360')).toEqual({ width: 640, height: 360 });
    expect(readFilm('#film=640x360&fps=25')).toEqual({ width: 640, height: 360, fps: 25 });
  });

  it('reads one moment and a camera, negative and broken numbers included', () => {
    expect(readFilm('#film=960x540&at=1.5&azimuth=-62&elevation=14.25&zoom=1.3&body=7&forces=0&colouring=2')).toEqual({
      width: 960,
      height: 540,
      at: 1.5,
      azimuth: -62,
      elevation: 14.25,
      zoom: 1.3,
      body: 7,
      forces: 0,
      colouring: 2,
    });
  });

  it('leaves out what it does not know and what is no number', () => {
    expect(readFilm('#film=10x20&speed=2&zoom=1.2.3')).toEqual({ width: 10, height: 20 });
    expect(readFilm('#film=10x20&at=-')).toBeNull();
  });

  it('is not asked for by any other address', () => {
    for (const hash of ['', '#', '#film', '#film=640', '#film=0x', '#film=-1x2', '#film=640x360;at=1', 'film=640x360', '#x&film=640x360'])
      expect(readFilm(hash)).toBeNull();
  });
});
