// The views of the scene. Their numbers are those of the shader (lit_shader.ts).

export interface ViewMode {
  id: string;
  label: string;
  number: number;
  hint: string;
  /** Quantity of the tiles that the view needs. */
  quantity: 'irradiance' | 'radiosity' | 'error' | 'unshot' | 'patchId' | 'mipLevel';
  /** Title of the false-colour legend; undefined: the label. */
  legend?: string;
  /** Unit of the false-colour legend; undefined: there is nothing to measure. */
  unit?: string;
  falseColour: 'off' | 'choice' | 'always';
  flat?: boolean;
}

export const VIEW_MODES: readonly ViewMode[] = [
  { id: 'lit', label: 'Lit', number: 0, hint: 'As the eye would see it', quantity: 'irradiance', falseColour: 'off' },
  {
    id: 'irradiance',
    label: 'Irradiance',
    number: 1,
    hint: 'Light that reaches each surface, without the colour of the surface',
    quantity: 'irradiance',
    unit: 'lx',
    falseColour: 'choice',
  },
  {
    id: 'radiosity',
    label: 'Radiosity',
    number: 2,
    hint: 'Light that leaves each surface: emitted and reflected',
    quantity: 'irradiance',
    unit: 'lm/m²',
    falseColour: 'always',
  },
  {
    id: 'unshot',
    label: 'Unshot',
    number: 3,
    hint: 'Light not shot yet, on a scale fixed by the irradiance; when the solve is done, how far patches differ from what was shot for them',
    quantity: 'unshot',
    legend: 'Unshot radiosity',
    unit: 'lm/m²',
    falseColour: 'always',
  },
  {
    id: 'error',
    label: 'Error',
    number: 4,
    hint: 'Estimated error of each texel',
    quantity: 'error',
    legend: 'Estimated error',
    unit: 'lx',
    falseColour: 'always',
  },
  {
    id: 'patches',
    label: 'Patches',
    number: 5,
    hint: 'Texels of the lightmap',
    quantity: 'irradiance',
    falseColour: 'off',
  },
  {
    id: 'mips',
    label: 'Mip level',
    number: 6,
    hint: 'Resolution of the light received so far',
    quantity: 'irradiance',
    falseColour: 'off',
  },
  {
    id: 'normals',
    label: 'Normals',
    number: 7,
    hint: 'Direction that each surface faces',
    quantity: 'irradiance',
    falseColour: 'off',
  },
  {
    id: 'albedo',
    label: 'Albedo',
    number: 8,
    hint: 'Colour of each surface',
    quantity: 'irradiance',
    falseColour: 'off',
  },
  {
    id: 'pages',
    label: 'Pages',
    number: 1,
    hint: 'The lightmaps themselves',
    quantity: 'irradiance',
    legend: 'Irradiance',
    unit: 'lx',
    falseColour: 'choice',
    flat: true,
  },
];

export function viewMode(id: string): ViewMode {
  return VIEW_MODES.find((mode) => mode.id === id) ?? VIEW_MODES[0]!;
}

/** The light of a picture: the light that leaves the surfaces, or the light that reaches them, divided by pi. */
export type ShownLight = 'leaving' | 'arriving';

export function shownLight({ number }: ViewMode): ShownLight {
  return number === 1 || number === 5 ? 'arriving' : 'leaving';
}

export const TONE_CURVES = [
  { id: 'neutral', label: 'Neutral', number: 0 },
  { id: 'aces', label: 'ACES', number: 1 },
  { id: 'agx', label: 'AgX', number: 2 },
  { id: 'none', label: 'None', number: 3 },
] as const;
