declare module 'three/examples/jsm/libs/basis/basis_transcoder.js' {
  const BASIS: import('./basis').BasisFactory;
  export default BASIS;
}
declare module '*.wasm?url' {
  const url: string;
  export default url;
}
